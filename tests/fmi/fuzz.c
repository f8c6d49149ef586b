/* Random sequences of calls, right and wrong ones, with extreme values: none may crash, and each has a status of FMI. */
#include <stdio.h>
#include <stdlib.h>
#include <math.h>
#include <string.h>
#include <stddef.h>
typedef void *C; typedef unsigned R;
typedef struct { void (*logger)(void*,const char*,int,const char*,const char*,...); void*(*a)(size_t,size_t); void(*f)(void*); void(*s)(void*,int); void*e; } CB;
C fmi2Instantiate(const char*,int,const char*,const char*,const CB*,int,int); void fmi2FreeInstance(C);
int fmi2SetupExperiment(C,int,double,double,int,double); int fmi2EnterInitializationMode(C); int fmi2ExitInitializationMode(C); int fmi2Terminate(C); int fmi2Reset(C);
int fmi2GetReal(C,const R*,size_t,double*); int fmi2GetBoolean(C,const R*,size_t,int*); int fmi2SetReal(C,const R*,size_t,const double*); int fmi2SetBoolean(C,const R*,size_t,const int*);
int fmi2GetFMUstate(C,void**); int fmi2SetFMUstate(C,void*); int fmi2FreeFMUstate(C,void**); int fmi2SerializedFMUstateSize(C,void*,size_t*); int fmi2SerializeFMUstate(C,void*,char*,size_t); int fmi2DeSerializeFMUstate(C,const char*,size_t,void**);
int fmi2GetDirectionalDerivative(C,const R*,size_t,const R*,size_t,const double*,double*); int fmi2DoStep(C,double,double,int);
extern const char model_token[]; extern const unsigned model_variable_count;
static void logger(void*e,const char*n,int s,const char*c,const char*m,...){(void)e;(void)n;(void)c; if(s<0||s>4||!strlen(m)) abort();}
static double pick(void){ switch(rand()%12){case 0:return NAN;case 1:return INFINITY;case 2:return -1;case 3:return 0;case 4:return 1e300;case 5:return -1e-300;case 6:return 1e9; default:return rand()/(double)RAND_MAX;} }
int main(int n,char**v){ unsigned long total=0, errors=0; srand(n>1?atoi(v[1]):1); int rounds=n>2?atoi(v[2]):300;
 CB cb={logger,0,0,0,0};
 for(int r=0;r<rounds;r++){ C c=fmi2Instantiate("x",1,rand()%50?model_token:"no",0,&cb,0,0); void*st=0; double t=0; char*bytes=0; size_t size=0;
  if(rand()%10==0) fmi2GetReal(NULL,0,0,0);
  if(r%2){ fmi2SetupExperiment(c,0,0,0,0,0); fmi2EnterInitializationMode(c); fmi2ExitInitializationMode(c); } /* a right start */
  for(int k=0;k<60;k++){ R vr=rand()%(model_variable_count+2); double x=pick(),y=0; int b=0,s=0; R vr2=rand()%(model_variable_count+1);
   switch(rand()%18){
    case 0:s=fmi2SetupExperiment(c,rand()%2,rand()%2?1e-6:pick(),rand()%3?0:pick(),rand()%2,pick());break;
    case 1:s=fmi2EnterInitializationMode(c);break; case 2:s=fmi2ExitInitializationMode(c);break;
    case 3:s=fmi2GetReal(c,&vr,1,&y);break; case 4:s=fmi2GetBoolean(c,&vr,1,&b);break;
    case 5:case 6:s=fmi2SetReal(c,&vr,1,&x);break; case 7:s=fmi2SetBoolean(c,&vr,1,&b);break;
    case 8:s=fmi2GetFMUstate(c,&st);break; case 9:if(st){s=fmi2SetFMUstate(c,st);}break; case 10:if(rand()%3==0)s=fmi2FreeFMUstate(c,&st);break;
    case 11:if(st){fmi2SerializedFMUstateSize(c,st,&size);free(bytes);bytes=malloc(size);s=fmi2SerializeFMUstate(c,st,bytes,size);if(rand()%2)bytes[rand()%size]^=1;}break;
    case 12:if(bytes&&c){void*o=0;s=fmi2DeSerializeFMUstate(c,bytes,size-(rand()%4==0),&o);if(o){if(rand()%2)fmi2SetFMUstate(c,o);fmi2FreeFMUstate(c,&o);}}break;
    case 13:s=fmi2GetDirectionalDerivative(c,&vr,1,&vr2,1,&x,&y);break;
    case 14:case 15:case 16:{double h=rand()%4?0.05*(rand()%4):pick(); if(h>5)h=rand()%2?INFINITY:h; if(h<1e3||isinf(h)||isnan(h)){s=fmi2DoStep(c,rand()%8?t:pick(),h,1); if(s<2)t+=h;}}break;
    case 17:if(rand()%4==0){s=rand()%2?fmi2Reset(c):fmi2Terminate(c);t=0;}break; }
   total++; if(s>=2)errors++; if(s<0||s>4)abort(); }
  if(st)fmi2FreeFMUstate(c,&st); free(bytes); fmi2FreeInstance(c); }
 printf("%lu calls, %lu errors\n",total,errors); return 0; }

MODULE Wrapped(NOSTEPIN) ! statements end at the semicolon, not at the line
  PROC main()
    MoveL ! where to
      [ [ 0 , - 0.5,
          0 ] , [0,1,0,0],   [-1,0,1,0],
        [9E9,9E9,9E9,9E9,9E9,9E9] ]
      , v20 ,fine ,
      tMill ! whose tool
      \ WObj
      :=wPart
      ;
    MOVEL [[5.e1,+.5,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20\V:=15,z1 \Inpos:=inpos20, tMill,\WObj:=wPart; movej [[100,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\wobj:=wPart;
    TPWrite "!no comment; no end"" of it";
  ENDPROC
ENDMODULE
